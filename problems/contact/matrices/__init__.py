"""The matrices of a contact problem: what is given is read and checked, G assembled, M⁻¹ taken apart into blocks."""
