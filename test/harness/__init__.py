"""What tests, campaigns, benches and the demo share: nodes as processes, spun nodes, example bags."""
