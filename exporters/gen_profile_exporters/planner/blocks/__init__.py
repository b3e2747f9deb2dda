"""Function blocks of which the next planner block is made; used by nothing but their tests yet."""
