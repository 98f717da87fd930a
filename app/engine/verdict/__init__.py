"""The audited verdict: shapes combined into a calibrated probability, rivals weighed, reliability with its reasons."""
