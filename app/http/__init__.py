"""One request on its way in and out, for the API and the pages alike: who asks, what is let in, how it is refused."""
