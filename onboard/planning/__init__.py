"""Planning where to look: motion primitives, the search (FVI, RVI, ARVI), redundancy, coordinate descent."""
