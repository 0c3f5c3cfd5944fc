"""The text of `tps check`: plain text, at most 100 columns."""

from toolpath_stiff.analysis.program_check import ProgramCheck


def text(check: ProgramCheck) -> str:
    """The findings of `tps check` as text."""
    lines = [f"{check.program}, read as {check.dialect}"]
    if check.kinematics:
        lines[0] += f", posted for {check.kinematics}"
    if check.interpreter != "builtin":
        lines.append("read by LinuxCNC's interpreter: codes are counted where they stand")
    if not check.complete:
        lines.append("NOT READ TO ITS END AS IT STANDS: figures are those of the blocks that could be read")
    lines.append(f"language: {check.language}")
    if check.needs:
        lines.append(f"needs: {', '.join(check.needs)}")
    findings = []
    for finding in check.findings:
        place = f"{finding.line}:{finding.column}" if finding.column else f"{finding.line or '-'}"
        findings.append(f"{finding.severity:<7} {place:>9}  {finding.text}")
    extents = [
        f"{axis.upper()}  {low:10.3f} to {high:10.3f} {unit}"
        for unit, ends in (("mm", check.extents_mm), ("deg", check.extents_deg))
        for axis, (low, high) in ends.items()
    ]
    times, speed = check.times_s, check.fastest_strut
    lengths = [f"{key:<8} {length:12.1f} mm {times[key]:10.1f} s" for key, length in check.lengths_mm.items()]
    lengths.append(f"dwell    {'':12}    {times['dwell']:10.1f} s")
    if speed:
        lengths.append(f"fastest strut in a cut: {speed['mm_per_min']:.0f} mm/min, line {speed['line']}")
    ignored = [f"{word.code:<7} {word.line}:{word.column}  {word.text}" for word in check.unsupported]
    sections = {
        "findings": findings or ["none"],
        "not acted upon": ignored or ["nothing"],
        "codes used (times, first line)": [
            f"{code.code:<6} {code.count:>7}  {code.line:>7}  {code.text}" for code in check.used
        ],
        "extents of cuts": extents,
        "lengths and times": lengths,
    }
    for title, rows in sections.items():
        if rows:
            lines += [f"\n{title}:", *(f"  {row}" for row in rows)]
    return "\n".join(lines) + "\n"
