"""Transient mixed lubrication of a reciprocating seal, from grease and roughness to a friction map for the node.

Read in this order: `grease`, `topography`, `flow_factors`, `reynolds` (film of a given gap), `elasticity`, `krylov`,
`contact` (film and seal together, one time step), `shear`, `groove`, `wall`, `kinematics`, `lubrication_case` (all
parameters), `seal_section` (the body by finite elements), `transient` (a whole motion), `findings`, `study`, `spool`,
`measuring_chain`, `oring_film` (the seal from finite elements), `friction_map`.
"""
