"""What measures the product: accuracy on labelled recordings, limits on simulated loops, speed beside its peers."""
