"""Friction physics and the estimator: no ROS, no files, no clock."""
