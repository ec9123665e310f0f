"""Finite-element O-ring: ring, gland, material and pressure -> contact stress, normal force and axial force."""
