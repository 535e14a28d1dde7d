package org.visavis.demo;

import android.view.View;

/** What an activity shows. */
interface Screen {
    View view();

    /** Brings it up to date; called several times a second. */
    void refresh(long now);
}
