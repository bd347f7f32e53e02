"""The matrices of a contact problem: validation, assembly of G, and the blocks of M⁻¹."""
