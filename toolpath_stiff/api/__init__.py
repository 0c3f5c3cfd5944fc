"""What people import, by what it is about; `toolpath_stiff` itself shows all of it.

Shop units at this door, SI behind it. Each function reads its inputs, calls one room, and hands what that found to a
result that prints, tabulates, draws and saves it; it computes nothing itself.
"""
