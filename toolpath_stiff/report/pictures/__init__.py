"""Pictures of results: one module a result, with `PICTURES`, file name -> function; the first is `plot()`."""
