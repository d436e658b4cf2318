"""The book of answers: what namlcp says of a fixed list of problems."""
