package org.visavis.demo;

import android.content.Context;
import android.view.View;
import android.widget.Button;
import android.widget.LinearLayout;
import android.widget.ScrollView;
import android.widget.SeekBar;
import android.widget.TextView;
import org.visavis.Sampler;

/** The conversation: the stage, and controls for gaze, sampler, microphone, and what else can be done. */
final class StageScreen implements Screen {
    /** What the activity does for it. */
    interface Actions {
        void microphone();

        void measure();
    }

    private final Demo demo;
    private final Motion motion;
    private final SplitView view;
    private final StageView stage;
    private final BarsView bars;
    private final TextView status;
    private final TextView sound;
    private final TextView voice;
    private final TextView label;
    private final Button hold;
    private final Button choose;
    private final Button microphone;
    private final String starting;

    StageScreen(final Context context, final Demo demo, final Actions actions) {
        this.demo = demo;
        motion = demo.motion();
        starting = context.getString(R.string.starting);
        stage = new StageView(context, motion, demo.engine().skeleton(), demo.life, demo.stage());
        LinearLayout panel = Ui.column(context, 12);
        panel.setBackgroundColor(Ui.PANEL);
        status = Ui.text(panel, 14, Ui.TEXT);
        bars = new BarsView(context, motion.times());
        panel.addView(bars, new LinearLayout.LayoutParams(LinearLayout.LayoutParams.MATCH_PARENT, Ui.dp(context, 36)));
        sound = Ui.text(panel, 14, Ui.BAD);

        label = Ui.text(panel, 14, Ui.DIM);
        SeekBar gaze = new SeekBar(context);
        gaze.setMax(101);
        gaze.setProgress(motion.gazeStep());
        gaze.setOnSeekBarChangeListener(new SeekBar.OnSeekBarChangeListener() {
            @Override
            public void onProgressChanged(SeekBar bar, int progress, boolean fromUser) {
                motion.setGazeStep(progress);
                showGaze(context);
            }

            @Override
            public void onStartTrackingTouch(SeekBar bar) {}

            @Override
            public void onStopTrackingTouch(SeekBar bar) {}
        });
        panel.addView(gaze, Ui.across(panel, 4));
        showGaze(context);

        LinearLayout row = new LinearLayout(context);
        choose = Ui.button(row, "", new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                Sampler[] samplers = Bench.samplers(demo.engine());
                int next = java.util.Arrays.asList(samplers).indexOf(motion.sampler()) + 1;
                motion.setSampler(samplers[next % samplers.length]);
            }
        });
        hold = Ui.button(row, "", new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                demo.life.hold(!demo.life.stands());
            }
        });
        panel.addView(row, Ui.across(panel, 0));
        microphone = Ui.button(panel, "", new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                actions.microphone();
            }
        });
        voice = Ui.text(panel, 14, Ui.DIM);
        Ui.button(panel, context.getString(R.string.measure), new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                actions.measure();
            }
        });
        Ui.text(panel, 14, Ui.DIM).setText(R.string.drag);
        ScrollView scroll = new ScrollView(context);
        scroll.setFillViewport(true);
        scroll.addView(panel);
        view = new SplitView(context, stage, scroll);
        refresh(System.nanoTime());
    }

    /** Leftmost: natural. */
    private void showGaze(Context context) {
        int step = motion.gazeStep();
        label.setText(step == 0 ? context.getString(R.string.gaze_natural) : context.getString(R.string.gaze_target, step - 1));
    }

    @Override
    public View view() {
        return view;
    }

    @Override
    public void shown(boolean now) {
        if (now) {
            stage.onResume();
        } else {
            stage.onPause();
        }
    }

    @Override
    public void refresh(long now) {
        String why = demo.life.says();
        if (why.isEmpty()) {
            why = motion.times().count() == 0 ? starting : motion.times().says();
        }
        Ui.show(status, why);
        Ui.show(sound, motion.note());
        Ui.show(voice, demo.microphone.says(now));
        boolean runs = demo.life.runs();
        choose.setText(motion.sampler().toString());
        hold.setText(demo.life.stands() ? R.string.go_on : R.string.hold);
        microphone.setText(demo.microphone.action());
        view.setKeepScreenOn(runs);
        bars.invalidate();
        stage.refresh();
    }
}
