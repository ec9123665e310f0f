"""The spool-valve paper: motion, walls, air, creep and groove of a seal, several seals on a spool, findings.

Read in this order: `groove`, `wall`, `kinematics`, `bonded_layer`, `study_case` (all parameters), `krylov`, `balance`,
`transient` (a whole motion), `findings`, `study`, `spool`, `measuring_chain`; `spool_evaluation` evaluates a
measurement as the paper does.
"""
