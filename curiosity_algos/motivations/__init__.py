"""What makes an individual interesting, beside reward."""
