"""What people import, by what it is about; `toolpath_stiff` itself shows all of it."""
