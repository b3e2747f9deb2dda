{{ constants }}

static void {{ name }}_init({{ name }} *fb)
{
    memset(fb, 0, sizeof *fb);
{{ initials }}
}

static int {{ name }}_step({{ name }} *fb)
{
    int left = 0;
{{ body }}
    return left;
}
