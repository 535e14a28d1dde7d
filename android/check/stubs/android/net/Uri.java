package android.net;

public abstract class Uri {
    private Uri() {}

    public static Uri fromParts(String scheme, String part, String fragment) {
        return new Uri() {
            @Override
            public String toString() {
                return scheme + ":" + part;
            }
        };
    }

    @Override
    public abstract String toString();
}
