"""The paper's projected fixed-point iterations (Studer & Glocker 2005, section 4)."""
