"""Trees: mechanisms, their structure, their positions by joint, their equations and modified copies."""
