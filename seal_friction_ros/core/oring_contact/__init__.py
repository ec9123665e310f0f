"""Finite-element O-ring: contact stress, normal force and axial force from ring, gland, material and pressure.

Data flow: `oring_case` (input), `mesh`, `material`, `elements`, `surroundings` (walls and fluid), `equilibrium`
(Newton's method, adaptive steps), `loading` (squeeze, seat, pressure), `results`,
`compliance` (of the face on the rod, for the film).
"""
