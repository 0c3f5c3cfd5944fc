"""Conversions between boundary units (mm, degrees, N/mm, inch) and SI (m, rad, N/m), the only ones in the package.

Everything inside the package is SI; everything that a user reads or writes is in the shop's units.
The functions take and return scalars or numpy arrays alike; they only multiply, so this module
costs nothing at start-up.
"""

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

T = TypeVar("T", float, "NDArray[np.float64]")

MM_PER_INCH = 25.4  # exact: international inch, 1959
RAD_PER_DEG = 3.141592653589793 / 180.0
SECONDS_PER_MINUTE = 60.0
SECONDS_PER_DAY = 86_400.0


def m_from_mm(mm: T) -> T:
    """Metres from millimetres."""
    return mm / 1e3


def mm3_from_m3(m3: T) -> T:
    """Cubic millimetres from cubic metres."""
    return m3 * 1e9


def mm_from_m(m: T) -> T:
    """Millimetres from metres."""
    return m * 1e3


def um_from_m(m: T) -> T:
    """Micrometres from metres."""
    return m * 1e6


def m_from_um(um: T) -> T:
    """Metres from micrometres."""
    return um / 1e6


def m_from_nm(nm: T) -> T:
    """Metres from nanometres, as in nm/N."""
    return nm / 1e9


def nm_from_m(m: T) -> T:
    """Nanometres from metres, as in nm/N."""
    return m * 1e9


def pa_from_gpa(gpa: T) -> T:
    """Pascal from gigapascal."""
    return gpa * 1e9


def rad_from_deg(deg: T) -> T:
    """Radians from degrees."""
    return deg * RAD_PER_DEG


def deg_from_rad(rad: T) -> T:
    """Degrees from radians."""
    return rad / RAD_PER_DEG


def n_per_m_from_n_per_mm(k: T) -> T:
    """N/m from N/mm."""
    return k * 1e3


def n_per_mm_from_n_per_m(k: T) -> T:
    """N/mm from N/m."""
    return k / 1e3


def n_per_m_from_n_per_um(k: T) -> T:
    """N/m from N/um."""
    return k * 1e6


def n_per_um_from_n_per_m(k: T) -> T:
    """N/um from N/m."""
    return k / 1e6


def s_from_min(minutes: T) -> T:
    """Seconds from minutes."""
    return minutes * 60.0


def min_from_s(seconds: T) -> T:
    """Minutes from seconds."""
    return seconds / SECONDS_PER_MINUTE


def per_s_from_per_min(rate: T) -> T:
    """Rate per second from rate per minute."""
    return rate / 60.0


def rad_per_s_from_per_min(speed: T) -> T:
    """rad/s from revolutions per minute."""
    return speed * (360.0 * RAD_PER_DEG / SECONDS_PER_MINUTE)


def per_min_from_rad_per_s(speed: T) -> T:
    """Revolutions per minute from rad/s."""
    return speed / (360.0 * RAD_PER_DEG / SECONDS_PER_MINUTE)


def m_per_s_from_mm_per_min(feed: T) -> T:
    """m/s from mm/min."""
    return feed / 60e3


def rad_per_s_from_deg_per_min(feed: T) -> T:
    """rad/s from degrees per minute."""
    return rad_from_deg(feed) / SECONDS_PER_MINUTE


def mm_per_min_from_m_per_s(feed: T) -> T:
    """mm/min from m/s."""
    return feed * 60e3


def pa_from_n_per_mm2(pressure: T) -> T:
    """N/m2 from N/mm2."""
    return pressure * 1e6


def n_per_mm2_from_pa(pressure: T) -> T:
    """N/mm2 from N/m2."""
    return pressure / 1e6
