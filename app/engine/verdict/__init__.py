"""The audited verdict: shapes fused to a calibrated probability, rivals heard, reliability with its reasons."""
