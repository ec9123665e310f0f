"""Live, recorded and replayable estimate of hydraulic seal friction for ROS 2."""
