"""Reading and writing files: YAML, JSON and disk safety, without any knowledge of pipes."""
