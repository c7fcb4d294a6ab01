/* How often QEMU executed each instruction: a plugin of its TCG.
 *
 * At the end, writes a line an instruction to the file of the argument `out`:
 * address, executions (both decimal), size in bytes, disassembly.
 *
 * Debian's QEMU knows plugins and ships no header, so the part of the plugin
 * interface (version 1, include/qemu/qemu-plugin.h) that is used is declared
 * here.
 */
#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum { INLINE_ADD_U64 = 0 };

void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, void (*)(plugin_id, struct qemu_plugin_tb *));
void qemu_plugin_register_atexit_cb(plugin_id, void (*)(plugin_id, void *), void *);
void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn *, int op, void *counter, uint64_t by);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *);
size_t qemu_plugin_insn_size(const struct qemu_plugin_insn *);
char *qemu_plugin_insn_disas(const struct qemu_plugin_insn *);

EXPORT int qemu_plugin_version = 1;

/* An instruction; it never moves, for translated code adds to its counter. */
struct counted {
    struct counted *next;
    uint64_t address, executions;
    size_t size;
    char *text;
};

enum { BUCKETS = 1 << 14 };
static struct counted *buckets[BUCKETS];
static const char *out;

static struct counted *find(struct qemu_plugin_insn *instruction) {
    uint64_t address = qemu_plugin_insn_vaddr(instruction);
    struct counted **bucket = &buckets[(address >> 1) % BUCKETS];
    for (struct counted *it = *bucket; it; it = it->next)
        if (it->address == address) return it;
    struct counted *it = calloc(1, sizeof *it);
    if (!it) abort();
    it->next = *bucket;
    it->address = address;
    it->size = qemu_plugin_insn_size(instruction);
    it->text = qemu_plugin_insn_disas(instruction);
    return *bucket = it;
}

static void translated(plugin_id id, struct qemu_plugin_tb *block) {
    (void)id;
    size_t length = qemu_plugin_tb_n_insns(block);
    for (size_t i = 0; i < length; i++) {
        struct qemu_plugin_insn *instruction = qemu_plugin_tb_get_insn(block, i);
        struct counted *it = find(instruction);
        qemu_plugin_register_vcpu_insn_exec_inline(instruction, INLINE_ADD_U64, &it->executions, 1);
    }
}

static void ended(plugin_id id, void *data) {
    (void)id, (void)data;
    FILE *file = fopen(out, "w");
    if (!file) abort();
    for (size_t i = 0; i < BUCKETS; i++)
        for (struct counted *it = buckets[i]; it; it = it->next)
            fprintf(file, "%" PRIu64 " %" PRIu64 " %zu %s\n", it->address, it->executions, it->size,
                    it->text ? it->text : "");
    if (fclose(file)) abort();
}

EXPORT int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv) {
    (void)info;
    for (int i = 0; i < argc; i++)
        if (!strncmp(argv[i], "out=", 4)) out = strdup(argv[i] + 4);
    if (!out) return 1;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
