"""The simulated servo: plant, controller, sensors, motions."""
