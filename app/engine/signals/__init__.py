"""Operations on sampled signals that several rooms share; none knows of loops."""
