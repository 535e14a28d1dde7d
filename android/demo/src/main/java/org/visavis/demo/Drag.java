package org.visavis.demo;

/**
 * A finger that moves the user. It takes the user's head or the disc below it, whichever it touches, and what it took stays under it; elsewhere the disc
 * jumps to the finger. The user stays where the picture shows him.
 */
final class Drag {
    private final float reach;
    private float height;
    private float offsetX;
    private float offsetY;
    private volatile boolean active;
    private final float[] screen = new float[3];

    /** @param reach pixels from the head or the disc at which a finger takes it */
    Drag(float reach) {
        this.reach = reach;
    }

    boolean active() {
        return active;
    }

    /** A finger comes down; {@code user} is the user's place (x, z), which may change. */
    void begin(Projection view, float x, float y, float[] user) {
        active = true;
        height = 0;
        offsetX = 0;
        offsetY = 0;
        float best = reach;
        for (float candidate : new float[] {0, Projection.HEAD}) {
            view.project(user[0], candidate, user[1], screen);
            float distance = (float) Math.hypot(screen[0] - x, screen[1] - y);
            if (distance <= best) {
                best = distance;
                height = candidate;
                offsetX = screen[0] - x;
                offsetY = screen[1] - y;
            }
        }
        move(view, x, y, user);
    }

    /** The finger is elsewhere: so is the user. */
    void move(Projection view, float x, float y, float[] user) {
        if (active && view.unproject(x + offsetX, y + offsetY, height, user)) {
            view.clampToReach(user);
        }
    }

    /** Height of what the finger holds: 0 for the disc, or the head's. */
    float height() {
        return height;
    }

    void end() {
        active = false;
    }
}
