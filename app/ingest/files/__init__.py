"""From the bytes of a file to text: unpacked, decoded, its first lines looked at; MATLAB's own bytes."""
