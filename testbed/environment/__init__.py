"""Wind, gusts, sensing and the communication network."""
