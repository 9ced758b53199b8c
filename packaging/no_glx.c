/* OpenCV's archive asks for these where it shares matrices with windows of OpenGL, which nothing here does. Hidden, so that
 * a graphics driver in the same process never meets them. */
#define HIDDEN __attribute__((visibility("hidden")))

HIDDEN void* glXGetProcAddressARB(const unsigned char* name) {
    (void)name;
    return 0;
}

HIDDEN void* glXGetCurrentContext(void) {
    return 0;
}

HIDDEN void* glXGetCurrentDisplay(void) {
    return 0;
}
