/* OpenGL ES without a window, for the pictures of the demo's stage: the functions of android.opengl.GLES20 that the stand-in declares, one to one. */
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl3.h>
#include <jni.h>
#include <stdio.h>
#include <stdlib.h>

#define GL(type, name) JNIEXPORT type JNICALL Java_android_opengl_GLES20_##name

GL(void, glAttachShader)(JNIEnv *env, jclass self, jint program, jint shader) { glAttachShader(program, shader); }
GL(void, glBindBuffer)(JNIEnv *env, jclass self, jint target, jint buffer) { glBindBuffer(target, buffer); }
GL(void, glBlendFunc)(JNIEnv *env, jclass self, jint source, jint destination) { glBlendFunc(source, destination); }
GL(void, glClear)(JNIEnv *env, jclass self, jint mask) { glClear(mask); }
GL(void, glClearColor)(JNIEnv *env, jclass self, jfloat red, jfloat green, jfloat blue, jfloat alpha) { glClearColor(red, green, blue, alpha); }
GL(void, glCompileShader)(JNIEnv *env, jclass self, jint shader) { glCompileShader(shader); }
GL(jint, glCreateProgram)(JNIEnv *env, jclass self) { return glCreateProgram(); }
GL(jint, glCreateShader)(JNIEnv *env, jclass self, jint type) { return glCreateShader(type); }
GL(void, glDepthFunc)(JNIEnv *env, jclass self, jint function) { glDepthFunc(function); }
GL(void, glDepthMask)(JNIEnv *env, jclass self, jboolean writes) { glDepthMask(writes); }
GL(void, glDisable)(JNIEnv *env, jclass self, jint what) { glDisable(what); }
GL(void, glDisableVertexAttribArray)(JNIEnv *env, jclass self, jint index) { glDisableVertexAttribArray(index); }
GL(void, glDrawArrays)(JNIEnv *env, jclass self, jint mode, jint first, jint count) { glDrawArrays(mode, first, count); }
GL(void, glDrawElements)(JNIEnv *env, jclass self, jint mode, jint count, jint type, jint offset) { glDrawElements(mode, count, type, (const void *)(intptr_t)offset); }
GL(void, glEnable)(JNIEnv *env, jclass self, jint what) { glEnable(what); }
GL(void, glEnableVertexAttribArray)(JNIEnv *env, jclass self, jint index) { glEnableVertexAttribArray(index); }
GL(void, glLinkProgram)(JNIEnv *env, jclass self, jint program) { glLinkProgram(program); }
GL(void, glUniform1f)(JNIEnv *env, jclass self, jint location, jfloat x) { glUniform1f(location, x); }
GL(void, glUniform1i)(JNIEnv *env, jclass self, jint location, jint x) { glUniform1i(location, x); }
GL(void, glUseProgram)(JNIEnv *env, jclass self, jint program) { glUseProgram(program); }
GL(void, glVertexAttribPointer)(JNIEnv *env, jclass self, jint index, jint size, jint type, jboolean share, jint stride, jint offset) { glVertexAttribPointer(index, size, type, share, stride, (const void *)(intptr_t)offset); }
GL(void, glViewport)(JNIEnv *env, jclass self, jint x, jint y, jint width, jint height) { glViewport(x, y, width, height); }

GL(void, glBufferData)(JNIEnv *env, jclass self, jint target, jint size, jobject data, jint usage) {
    glBufferData(target, size, (*env)->GetDirectBufferAddress(env, data), usage);
}
GL(void, glGenBuffers)(JNIEnv *env, jclass self, jint count, jintArray buffers, jint offset) {
    jint *all = (*env)->GetIntArrayElements(env, buffers, NULL);
    glGenBuffers(count, (GLuint *)all + offset);
    (*env)->ReleaseIntArrayElements(env, buffers, all, 0);
}
static jstring text(JNIEnv *env, void (*get)(GLuint, GLsizei, GLsizei *, GLchar *), jint object) {
    char log[4096] = "";
    get(object, sizeof log, NULL, log);
    return (*env)->NewStringUTF(env, log);
}
GL(jstring, glGetProgramInfoLog)(JNIEnv *env, jclass self, jint program) { return text(env, glGetProgramInfoLog, program); }
GL(jstring, glGetShaderInfoLog)(JNIEnv *env, jclass self, jint shader) { return text(env, glGetShaderInfoLog, shader); }
static void value(JNIEnv *env, void (*get)(GLuint, GLenum, GLint *), jint object, jint name, jintArray values, jint offset) {
    GLint got = 0;
    get(object, name, &got);
    jint one = got;
    (*env)->SetIntArrayRegion(env, values, offset, 1, &one);
}
GL(void, glGetProgramiv)(JNIEnv *env, jclass self, jint program, jint name, jintArray values, jint offset) { value(env, glGetProgramiv, program, name, values, offset); }
GL(void, glGetShaderiv)(JNIEnv *env, jclass self, jint shader, jint name, jintArray values, jint offset) { value(env, glGetShaderiv, shader, name, values, offset); }
GL(jint, glGetUniformLocation)(JNIEnv *env, jclass self, jint program, jstring name) {
    const char *chars = (*env)->GetStringUTFChars(env, name, NULL);
    jint location = glGetUniformLocation(program, chars);
    (*env)->ReleaseStringUTFChars(env, name, chars);
    return location;
}
GL(void, glShaderSource)(JNIEnv *env, jclass self, jint shader, jstring source) {
    const char *chars = (*env)->GetStringUTFChars(env, source, NULL);
    glShaderSource(shader, 1, &chars, NULL);
    (*env)->ReleaseStringUTFChars(env, source, chars);
}
GL(void, glUniform3fv)(JNIEnv *env, jclass self, jint location, jint count, jfloatArray values, jint offset) {
    jfloat *all = (*env)->GetFloatArrayElements(env, values, NULL);
    glUniform3fv(location, count, all + offset);
    (*env)->ReleaseFloatArrayElements(env, values, all, JNI_ABORT);
}
GL(void, glUniform4fv)(JNIEnv *env, jclass self, jint location, jint count, jfloatArray values, jint offset) {
    jfloat *all = (*env)->GetFloatArrayElements(env, values, NULL);
    glUniform4fv(location, count, all + offset);
    (*env)->ReleaseFloatArrayElements(env, values, all, JNI_ABORT);
}
GL(void, glUniformMatrix4fv)(JNIEnv *env, jclass self, jint location, jint count, jboolean transpose, jfloatArray values, jint offset) {
    jfloat *all = (*env)->GetFloatArrayElements(env, values, NULL);
    glUniformMatrix4fv(location, count, transpose, all + offset);
    (*env)->ReleaseFloatArrayElements(env, values, all, JNI_ABORT);
}

static EGLDisplay display;
static EGLContext context;
static GLuint frame[2], colours[2], depth;

static void need(int done, const char *what) {
    if (!done) {
        fprintf(stderr, "gl.c: no %s (EGL error %x, OpenGL error %x)\n", what, eglGetError(), context ? glGetError() : 0);
        exit(1);
    }
}

/* A frame of four samples a pixel, resolved into one of one sample. */
JNIEXPORT void JNICALL Java_android_opengl_StandInGl_begin(JNIEnv *env, jclass self, jint width, jint height) {
    PFNEGLGETPLATFORMDISPLAYEXTPROC get = (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress("eglGetPlatformDisplayEXT");
    need(get != NULL, "surfaceless platform");
    display = get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    need(eglInitialize(display, NULL, NULL), "display");
    EGLConfig config;
    EGLint count;
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE, EGL_DONT_CARE, EGL_NONE};
    need(eglChooseConfig(display, wanted, &config, 1, &count) && count, "config");
    const EGLint version[] = {EGL_CONTEXT_CLIENT_VERSION, 3, EGL_NONE};
    need(eglBindAPI(EGL_OPENGL_ES_API), "API");
    context = eglCreateContext(display, config, EGL_NO_CONTEXT, version);
    need(context != EGL_NO_CONTEXT && eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context), "context");
    glGenFramebuffers(2, frame);
    glGenRenderbuffers(2, colours);
    glGenRenderbuffers(1, &depth);
    for (int i = 0; i < 2; i++) {
        glBindFramebuffer(GL_FRAMEBUFFER, frame[i]);
        glBindRenderbuffer(GL_RENDERBUFFER, colours[i]);
        glRenderbufferStorageMultisample(GL_RENDERBUFFER, i ? 0 : 4, GL_RGBA8, width, height);
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colours[i]);
    }
    glBindFramebuffer(GL_FRAMEBUFFER, frame[0]);
    glBindRenderbuffer(GL_RENDERBUFFER, depth);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, 4, GL_DEPTH_COMPONENT24, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
    need(glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE, "frame");
}

JNIEXPORT void JNICALL Java_android_opengl_StandInGl_end(JNIEnv *env, jclass self, jint width, jint height, jintArray pixels) {
    need(glGetError() == GL_NO_ERROR, "drawing without errors");
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, frame[1]);
    glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, frame[1]);
    unsigned char *bytes = malloc(4 * (size_t)width * height);
    need(bytes != NULL, "memory");
    glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, bytes);
    jint *out = (*env)->GetIntArrayElements(env, pixels, NULL);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const unsigned char *p = bytes + 4 * ((size_t)(height - 1 - y) * width + x);
            out[(size_t)y * width + x] = (jint)(0xff000000u | (unsigned)p[0] << 16 | (unsigned)p[1] << 8 | p[2]);
        }
    }
    (*env)->ReleaseIntArrayElements(env, pixels, out, 0);
    free(bytes);
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display, context);
    eglTerminate(display);
}
