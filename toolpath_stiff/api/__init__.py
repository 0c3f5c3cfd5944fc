"""The public API, by topic; `toolpath_stiff` itself re-exports all of it."""
