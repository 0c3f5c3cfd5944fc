"""Tables as offices write them: CSV in any dialect, Excel workbooks."""

from toolpath_stiff.tables.reading import Columns, Table, parse_table, read_table
from toolpath_stiff.tables.workbook import split_name

__all__ = ["Columns", "Table", "parse_table", "read_table", "split_name"]
