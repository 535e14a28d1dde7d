package org.visavis.demo;

import android.view.View;

/** What an activity shows. */
interface Screen {
    View view();

    /** The activity comes to the front, or leaves it. */
    void shown(boolean now);

    /** Brings it up to date; called several times a second. */
    void refresh(long now);
}
