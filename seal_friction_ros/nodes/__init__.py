"""rclpy nodes. No arithmetic."""
