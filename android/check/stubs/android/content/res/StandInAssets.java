package android.content.res;

import java.io.File;
import java.lang.reflect.Field;
import javax.xml.parsers.DocumentBuilderFactory;
import org.w3c.dom.Element;
import org.w3c.dom.NodeList;

/** Makes what only the platform can make: assets of a folder or a file, the app's strings (system property visavis.strings: its strings.xml). */
public final class StandInAssets {
    public static final Resources RESOURCES = new Resources();

    /** Milliseconds that each read takes. */
    public static volatile int delay;

    private StandInAssets() {}

    public static AssetManager folder(File folder) {
        return new AssetManager(folder, -1, 0);
    }

    public static AssetManager inside(File apk, long offset, long length) {
        return new AssetManager(apk, offset, length);
    }

    public static void density(float density) {
        RESOURCES.metrics.density = density;
        RESOURCES.metrics.scaledDensity = density;
    }

    static String string(int id) {
        try {
            String name = null;
            for (Field field : Class.forName("org.visavis.demo.R$string").getFields()) {
                if (field.getInt(null) == id) {
                    name = field.getName();
                }
            }
            NodeList all = DocumentBuilderFactory.newInstance().newDocumentBuilder().parse(new File(System.getProperty("visavis.strings")))
                    .getElementsByTagName("string");
            for (int i = 0; i < all.getLength(); i++) {
                if (((Element) all.item(i)).getAttribute("name").equals(name)) {
                    return all.item(i).getTextContent();
                }
            }
            throw new IllegalArgumentException("no string " + name);
        } catch (RuntimeException e) {
            throw e;
        } catch (Exception e) {
            throw new IllegalStateException(e);
        }
    }
}
