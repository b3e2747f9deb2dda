typedef struct {
{{ members }}
#ifdef CHECKED
    int32_t fault_, turns_;
#endif
} {{ name }};
