"""Mixed lubrication of a sliding seal, from grease and roughness to a friction map for the node.

Read in this order: `grease`, `topography`, `flow_factors`, `reynolds` (film of a given gap), `elasticity`,
`contact` (film and seal together, one time step), `seal_section` (a seal that is no O-ring), `lubrication_case` (all
parameters), `model` (with the friction of a film), `oring_film` (the seal from finite elements), `friction_map`.
"""
