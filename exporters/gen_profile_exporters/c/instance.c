{{ constants }}

static void {{ name }}_init({{ name }} *fb) {
    memset(fb, 0, sizeof *fb);
{{ initials }}
}

{{ parts }}
static APART void {{ name }}_step({{ name }} *fb) {
    BEGIN();
{{ body }}
    END();
}
