"""Studies of published rigs: the spool-valve paper, computed and evaluated. `seal_friction_ros` knows none of it.

A package of its own in the same distribution: it takes film, contact, bags and pages from `seal_friction_ros`, and its
commands (``seal_friction ehl run``, ``ehl study``, ``spool``) appear beside those of that package.
"""
