"""Whatever the program, what passes the fence holds nothing that rs274 would run: random texts of dangerous pieces."""

from __future__ import annotations

import re

from hypothesis import given, settings
from hypothesis import strategies as st

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.linuxcnc.fence import refuse_other_programs
from toolpath_stiff.nc.linuxcnc.inputs import numbered, split

PIECES = st.one_of(
    st.sampled_from(
        [
            "M",
            "m",
            "1",
            "0",
            "01",
            "100",
            "199",
            "M101",
            "M1 0 1",
            "m0150",
            "M+1",
            "M.",
            "150",
            ".0",
            "[",
            "]",
            "#",
            "<",
            ">",
            "=",
            "-",
            "+",
            "/",
            "/2",
            "%",
            "O",
            "o",
            "call",
            "sub",
            "endsub",
            "while",
            "O100",
            "o<a>",
            "o<../a>",
            "M98",
            "P",
            "(",
            ")",
            ";",
            "py",
            "PY,",
            "p y",
            "pyrun",
            ",",
            "open('x','w')",
            "abort,",
            "LOGOPEN",
            "MOD",
            "ABS",
            "G1 X1",
            "N5",
            " ",
            "\t",
            "\r",
            "\n",
            "\n",
            "\n",
            "\x0c",
            "\x1a",
            "\ufeff",
            "\u00a0",
            "\u2028",
            "\u200b",
            "\u0661",
            "\u0131",
            "\u017f",
            "\uff2d",
            "\\",
            "'",
            '"',
            "^",
            "@",
            "$",
        ]
    ),
    st.text(max_size=3),
)
TAG = re.compile(r"\((?:\d+|abort,stopped by the program)\)")
# As rs274 reads: no blanks, small letters; a number after m that comes to 100 to 199, or is computed.
USER_CODE = re.compile(r"m(?!od)(?:[+-]?0*1\d\d(?!\d)|[+-]?0*99\.\d|[+-]?[#\[a-z])")


@given(st.lists(PIECES, max_size=25), st.booleans())
@settings(max_examples=500, deadline=None, derandomize=True)
def test_what_passes_holds_nothing_that_runs(pieces, block_delete):
    try:
        lines = split(split_lines("".join(pieces), "part.nc"), "part.nc")
        refuse_other_programs(lines, "part.nc")
        copy = numbered(lines, "part.nc", block_delete=block_delete)
    except InputError:
        return
    assert copy.isascii()
    for line in copy.split("\n"):
        bare = TAG.sub("", line)
        assert not set(bare) & set("();\t\r "), line
        names_out = re.sub(r"<[^<>]*>", "<>", bare.lower())
        assert not USER_CODE.search(names_out), line
        assert "/" not in "".join(re.findall(r"^n\d*o(<[^<>]*>)", bare.lower())), line
