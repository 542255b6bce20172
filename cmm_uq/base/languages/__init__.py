"""A document's texts said in other languages: a catalogue a language, numbers and dates by locale."""
