"""Pictures of certificates and pages, each from plain arrays and words."""
