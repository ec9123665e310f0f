"""Files in, files out: bags, logs, reports. No ROS graph."""
