"""The command line ``seal_friction``: one file per command, with ``add_parser(commands)`` and ``run(arguments)``."""
