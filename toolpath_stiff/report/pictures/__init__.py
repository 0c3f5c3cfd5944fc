"""The pictures of results: a module a result, `PICTURES` with file name -> function; the first is `plot()`."""
