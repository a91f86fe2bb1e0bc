"""What goes over the wire: ROS 2 messages, topics, checks on arrival, Zenoh sessions."""
