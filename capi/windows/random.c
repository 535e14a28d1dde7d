/* ProcessPrng, with which Rust seeds its hash maps, for Wine 8, which lacks it. For tests under Wine; Windows has its own. */
#include <windows.h>
#include <ntsecapi.h>

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T length) {
    return RtlGenRandom(data, (ULONG)length);
}
