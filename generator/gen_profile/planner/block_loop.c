#define CHECKED
#include "BLOCK.c"
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
EXPORT long instance_size(void) { return sizeof(BLOCK); }
EXPORT void instance_init(BLOCK *fb) { BLOCK_init(fb); }
EXPORT int instance_play(BLOCK *fb, const double *inputs, long cycles, double *outputs) {
    for (long cycle = 0; cycle < cycles && fb->fault_ == 0; ++cycle) {
TAKEN        BLOCK_step(fb);
GIVEN    }
    return fb->fault_;
}
