"""The command line ``seal_friction``: one file per subject, with ``add_parser(commands)`` and runs."""
