"""Keys, electronic signatures of PDF (PAdES) and XML (XAdES), time stamps, and what is found of them in a file."""
