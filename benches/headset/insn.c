/* A plugin for qemu-aarch64 (7.2 or newer, -plugin): counts instructions between markers.
 *
 * A marker is HINT #62, which processors take for a NOP, or the system call umask, for programs whose machine code is not ours
 * (JavaScript engines). At each one, and at the end, the counts since the last marker go to stderr as
 * `insn <instructions> <int8 multiply-adds> <16-byte vector loads>`. Counted are all instructions of the process; multiply-adds are those of SDOT and
 * UDOT (16 a 128-bit instruction), SMMLA and USMMLA (32), of rows and columns that only pad a tile too. One thread only.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
typedef unsigned int vcpu_index;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum { INLINE_ADD_U64 = 0, CB_NO_REGS = 0 };
extern void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, struct qemu_plugin_tb *));
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
extern struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
extern const void *qemu_plugin_insn_data(const struct qemu_plugin_insn *);
extern void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn *, int, void *, uint64_t);
extern void qemu_plugin_register_vcpu_syscall_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, vcpu_index, int64_t, uint64_t, uint64_t, uint64_t, uint64_t,
                                                 uint64_t, uint64_t, uint64_t, uint64_t));
extern void qemu_plugin_register_atexit_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, void *), void *);
extern void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *, void (*)(vcpu_index, void *), int, void *);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;

static uint64_t total, macs, loads;

static void marker(vcpu_index cpu, void *unused) {
  (void)cpu, (void)unused;
  fprintf(stderr, "insn %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", total, macs, loads);
  total = macs = loads = 0;
}

static void called(qemu_plugin_id_t id, vcpu_index cpu, int64_t number, uint64_t a, uint64_t b, uint64_t c, uint64_t d, uint64_t e, uint64_t f,
                   uint64_t g, uint64_t h) {
  (void)id, (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h;
  if (number == 166) marker(cpu, NULL); /* umask on arm64 */
}

static void ended(qemu_plugin_id_t id, void *unused) {
  (void)id;
  marker(0, unused);
}

static unsigned mac_count(uint32_t i) {
  uint32_t quad = i >> 30 & 1;
  if ((i & 0x9FE0FC00) == 0x0E809400) return quad ? 16 : 8; /* sdot, udot */
  if ((i & 0x9FC0F400) == 0x0F80E000) return quad ? 16 : 8; /* by element */
  if ((i & 0xDFE0F400) == 0x4E80A400) return 32;            /* smmla, ummla, usmmla */
  return 0;
}

static unsigned quad_loads(uint32_t i) {
  if ((i & 0xFFC00000) == 0x3DC00000 || (i & 0xFFE00000) == 0x3CC00000) return 1; /* ldr q, ldur q */
  if ((i & 0xFFE00C00) == 0x3CE00800) return 1;                                    /* ldr q, register */
  if ((i & 0xFE400000) == 0xAC400000) return 2;                                    /* ldp q */
  if ((i & 0xBF400000) == 0x0C400000 && i >> 30 & 1) {                             /* ld1 of several registers */
    switch (i >> 12 & 15) { case 7: return 1; case 10: return 2; case 6: return 3; case 2: return 4; default: return 0; }
  }
  return 0;
}

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb *tb) {
  (void)id;
  for (size_t n = 0; n < qemu_plugin_tb_n_insns(tb); n++) {
    struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, n);
    uint32_t code;
    memcpy(&code, qemu_plugin_insn_data(insn), 4);
    if (code == 0xD50327DF) { /* hint #62 */
      qemu_plugin_register_vcpu_insn_exec_cb(insn, marker, CB_NO_REGS, NULL);
      continue;
    }
    qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &total, 1);
    unsigned m = mac_count(code), l = quad_loads(code);
    if (m) qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &macs, m);
    if (l) qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &loads, l);
  }
}

__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id, const void *info, int argc, char **argv) {
  (void)info, (void)argc, (void)argv;
  qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
  qemu_plugin_register_vcpu_syscall_cb(id, called);
  qemu_plugin_register_atexit_cb(id, ended, NULL);
  return 0;
}
