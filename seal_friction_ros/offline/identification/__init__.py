"""From bags, logs and data sheets to a seal file."""
