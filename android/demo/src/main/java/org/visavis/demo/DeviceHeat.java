package org.visavis.demo;

import android.content.Context;
import android.content.Intent;
import android.content.IntentFilter;
import android.os.BatteryManager;
import android.os.PowerManager;

/** Heat as Android tells it. */
final class DeviceHeat implements Heat {
    private static final String[] STATUS = {"none", "light", "moderate", "severe", "critical", "emergency", "shutdown"};

    private final Context context;

    DeviceHeat(Context context) {
        this.context = context.getApplicationContext();
    }

    @Override
    public float battery() {
        Intent battery = context.registerReceiver(null, new IntentFilter(Intent.ACTION_BATTERY_CHANGED));
        int tenths = battery == null ? Integer.MIN_VALUE : battery.getIntExtra(BatteryManager.EXTRA_TEMPERATURE, Integer.MIN_VALUE);
        return tenths == Integer.MIN_VALUE ? Float.NaN : tenths / 10f;
    }

    @Override
    public String status() {
        PowerManager power = (PowerManager) context.getSystemService(Context.POWER_SERVICE);
        int status = power.getCurrentThermalStatus();
        return status >= 0 && status < STATUS.length ? STATUS[status] : String.valueOf(status);
    }
}
