package android.opengl;

import java.nio.Buffer;

/** Of this machine, see StandInGl. */
public class GLES20 {
    public static final int GL_ARRAY_BUFFER = 34962;
    public static final int GL_ELEMENT_ARRAY_BUFFER = 34963;
    public static final int GL_STATIC_DRAW = 35044;
    public static final int GL_DYNAMIC_DRAW = 35048;
    public static final int GL_BLEND = 3042;
    public static final int GL_ONE = 1;
    public static final int GL_ONE_MINUS_SRC_ALPHA = 771;
    public static final int GL_LEQUAL = 515;
    public static final int GL_VERTEX_SHADER = 35633;
    public static final int GL_FRAGMENT_SHADER = 35632;
    public static final int GL_COMPILE_STATUS = 35713;
    public static final int GL_LINK_STATUS = 35714;
    public static final int GL_COLOR_BUFFER_BIT = 16384;
    public static final int GL_DEPTH_BUFFER_BIT = 256;
    public static final int GL_DEPTH_TEST = 2929;
    public static final int GL_FLOAT = 5126;
    public static final int GL_UNSIGNED_BYTE = 5121;
    public static final int GL_UNSIGNED_INT = 5125;
    public static final int GL_TRIANGLES = 4;
    public static final int GL_TRIANGLE_STRIP = 5;

    public GLES20() {}

    public static native void glAttachShader(int program, int shader);

    public static native void glBindBuffer(int target, int buffer);

    public static native void glBlendFunc(int source, int destination);

    public static native void glBufferData(int target, int size, Buffer data, int usage);

    public static native void glClear(int mask);

    public static native void glClearColor(float red, float green, float blue, float alpha);

    public static native void glCompileShader(int shader);

    public static native int glCreateProgram();

    public static native int glCreateShader(int type);

    public static native void glDepthFunc(int function);

    public static native void glDepthMask(boolean writes);

    public static native void glDisable(int what);

    public static native void glDisableVertexAttribArray(int index);

    public static native void glDrawArrays(int mode, int first, int count);

    public static native void glDrawElements(int mode, int count, int type, int offset);

    public static native void glEnable(int what);

    public static native void glEnableVertexAttribArray(int index);

    public static native void glGenBuffers(int count, int[] buffers, int offset);

    public static native String glGetProgramInfoLog(int program);

    public static native void glGetProgramiv(int program, int name, int[] values, int offset);

    public static native String glGetShaderInfoLog(int shader);

    public static native void glGetShaderiv(int shader, int name, int[] values, int offset);

    public static native int glGetUniformLocation(int program, String name);

    public static native void glLinkProgram(int program);

    public static native void glShaderSource(int shader, String source);

    public static native void glUniform1f(int location, float x);

    public static native void glUniform1i(int location, int x);

    public static native void glUniform3fv(int location, int count, float[] values, int offset);

    public static native void glUniform4fv(int location, int count, float[] values, int offset);

    public static native void glUniformMatrix4fv(int location, int count, boolean transpose, float[] values, int offset);

    public static native void glUseProgram(int program);

    public static native void glVertexAttribPointer(int index, int size, int type, boolean share, int stride, int offset);

    public static native void glViewport(int x, int y, int width, int height);
}
