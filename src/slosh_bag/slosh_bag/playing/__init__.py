"""What is published when a bag is played."""
