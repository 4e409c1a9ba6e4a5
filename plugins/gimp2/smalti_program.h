/* Finds the program smalti and has it evolve a picture.
 *
 * The C twin of plugins/shared/smalti_program.py, for smalti.c alone: gimptool compiles one source file. It knows no
 * image and no layer. Pictures go in and come out through pipes, so that nothing is left on the disk when GIMP kills
 * the plug-in; the protocol is told in docs/plugins.md. */
#ifndef SMALTI_PROGRAM_H
#define SMALTI_PROGRAM_H

#include <libgimp/gimp.h>
#include <gio/gio.h>
#include <glib/gstdio.h>
#include <stdio.h>
#include <string.h>
#ifdef __linux__
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>
#endif

/* The version of smalti that this file came with. An older program may not know what is asked of it here. */
#define SMALTI_VERSION "0.1.0"

/* A file beside the plug-in that names the program; `smalti plugins install` writes it. */
#define SMALTI_NOTE "smalti_program.txt"

/* The longest side of a picture that the program draws. */
#define OUTPUT_SIDE_MAX_PX 65535

#ifdef G_OS_WIN32
#define PROGRAM_NAME "smalti.exe"
#else
#define PROGRAM_NAME "smalti"
#endif

/* A value of an option, as the program names it and as people read it. */
typedef struct {
    const gchar *name;
    const gchar *label;
} Choice;

static const Choice STYLES[] = {
    {"mosaic", "Mosaic"},
    {"paint", "Brush strokes"},
    {"spray", "Clouds of spray"},
    {"free", "Closest likeness"},
};

/* The first leaves the choice to the style; the same holds for grout. */
static const Choice MASKS[] = {
    {"auto", "As the style has it"},
    {"square", "Squares"},
    {"border", "Squares with a dark edge"},
    {"lines", "Cords"},
    {"flower", "Flowers"},
    {"disc", "Discs"},
    {"triangle", "Triangles"},
    {"hexagon", "Hexagons"},
    {"brush", "Brush strokes"},
};

enum { GROUT_OF_STYLE, GROUT_NONE, GROUT_AUTO, GROUT_COLOR };

static const Choice GROUTS[] = {
    [GROUT_OF_STYLE] = {"style", "As the style has it"},
    [GROUT_NONE] = {"none", "None"},
    [GROUT_AUTO] = {"auto", "A little darker than the picture"},
    [GROUT_COLOR] = {"color", "Of one colour"},
};

/* What a plug-in asks for. Plain bytes, since GIMP remembers them from call to call. */
typedef struct {
    gint style, mask, grout; /* places in the tables above */
    GimpRGB grout_color;
    gint tiles, evals; /* 0 where the program may choose */
    gint seed;
    gint size; /* longer side in px at which the picture evolves */
    gdouble scale;
    gboolean on_new_layer;
} Options;

/* Hears what the program does, and how much of it is done, from 0 to 1. */
typedef void (*Progress)(const gchar *doing, gdouble share);

/* Work of the program that goes on while the main loop runs. */
typedef struct {
    GMainLoop *loop;
    GSubprocess *child;
    gint unfinished; /* of the three pipes and the process */
    Progress progress;
    GdkPixbuf *made;
    GError *unreadable;
    gchar *sentence; /* the last one that is not about progress */
} Work;

static void refuse(GError **error, const gchar *format, ...) G_GNUC_PRINTF(2, 3);

/* Sets one sentence for the person before the picture. */
static void refuse(GError **error, const gchar *format, ...)
{
    va_list values;
    va_start(values, format);
    g_propagate_error(error, g_error_new_valist(G_IO_ERROR, G_IO_ERROR_FAILED, format, values));
    va_end(values);
}

#ifdef __linux__
/* GIMP cancels a plug-in by SIGKILL, which leaves it no time to end what it has started. */
static void end_with_parent(gpointer parent)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != GPOINTER_TO_INT(parent))
        _exit(1);
}
#endif

static GSubprocess *start(const gchar *const *command, GSubprocessFlags pipes, GError **error)
{
    GSubprocessLauncher *launcher = g_subprocess_launcher_new(pipes);
#ifdef __linux__
    g_subprocess_launcher_set_child_setup(launcher, end_with_parent, GINT_TO_POINTER(getpid()), NULL);
#endif
    GError *why = NULL;
    GSubprocess *child = g_subprocess_launcher_spawnv(launcher, command, &why);
    if (!child)
        refuse(error, "%s cannot be started: %s", command[0], why->message);
    g_clear_error(&why);
    g_object_unref(launcher);
    return child;
}

/* Whether the program is not older than this plug-in. */
static gboolean is_new_enough(const gchar *program, GError **error)
{
    const gchar *command[] = {program, "--version", NULL};
    GSubprocess *child = start(command, G_SUBPROCESS_FLAGS_STDOUT_PIPE | G_SUBPROCESS_FLAGS_STDERR_SILENCE, error);
    if (!child)
        return FALSE;
    gchar *told = NULL;
    g_subprocess_communicate_utf8(child, NULL, NULL, &told, NULL, NULL);
    g_object_unref(child);

    guint found[3] = {0}, needed[3] = {0};
    sscanf(SMALTI_VERSION, "%u.%u.%u", &needed[0], &needed[1], &needed[2]);
    const gint count = told ? sscanf(told, "smalti %u.%u.%u", &found[0], &found[1], &found[2]) : 0;
    g_free(told);
    if (count < 2) {
        refuse(error, "%s is not smalti: it does not tell a version", program);
        return FALSE;
    }
    for (gint part = 0; part < 3; part++) {
        if (found[part] > needed[part])
            return TRUE;
        if (found[part] < needed[part]) {
            refuse(error,
                   "%s is smalti %u.%u.%u, and this plug-in needs " SMALTI_VERSION " or later. Install a newer one, or "
                   "have the program install its own plug-in: smalti plugins install",
                   program, found[0], found[1], found[2]);
            return FALSE;
        }
    }
    return TRUE;
}

/* The path of a program that a person has written; `~` is home, and a mere name is looked for on the PATH. */
static gchar *program_named(const gchar *named)
{
    gchar *path = g_str_has_prefix(named, "~/") ? g_build_filename(g_get_home_dir(), named + 2, NULL) : g_strdup(named);
    gchar *found = g_find_program_in_path(path);
    g_free(path);
    return found;
}

/* The program that has installed this plug-in. */
static gchar *program_noted(const gchar *plug_in_path)
{
    gchar *folder = g_path_get_dirname(plug_in_path);
    gchar *note = g_build_filename(folder, SMALTI_NOTE, NULL);
    gchar *named = NULL, *found = NULL;
    if (g_file_get_contents(note, &named, NULL, NULL))
        found = program_named(g_strstrip(named));
    g_free(named);
    g_free(note);
    g_free(folder);
    return found;
}

/* The path of the program: what SMALTI names, what installed this plug-in, PATH, usual folders. NULL and an error if
 * there is none, or if it is older than this plug-in. */
static gchar *find_program(const gchar *plug_in_path, GError **error)
{
    /* A Flatpak sees the programs of its host in the last two. */
    static const gchar *folders[] = {"~/.cargo/bin",      "~/.local/bin",           "/usr/local/bin",   "/usr/bin",
                                     "/opt/homebrew/bin", "/run/host/usr/local/bin", "/run/host/usr/bin"};
    const gchar *named = g_getenv("SMALTI");
    gchar *program = NULL;
    if (named && *named) {
        program = program_named(named);
        if (!program) {
            refuse(error, "%s, which SMALTI names, is no program", named);
            return NULL;
        }
    }
    if (!program)
        program = program_noted(plug_in_path);
    if (!program)
        program = g_find_program_in_path("smalti");
    for (guint place = 0; !program && place < G_N_ELEMENTS(folders); place++) {
        gchar *path = g_build_filename(folders[place], PROGRAM_NAME, NULL);
        program = program_named(path);
        g_free(path);
    }
    if (!program)
        refuse(error, "The program smalti was not found. Install it (cargo install --locked --path . in its source), "
                      "put it on the PATH, or name it in the environment variable SMALTI");
    else if (!is_new_enough(program, error))
        g_clear_pointer(&program, g_free);
    return program;
}

/* The flags of `smalti evolve` that say what is asked for. */
static void add_flags(GPtrArray *command, const Options *options, gint output_side_px)
{
    guchar red, green, blue;
    gimp_rgb_get_uchar(&options->grout_color, &red, &green, &blue);
    const struct {
        const gchar *flag;
        gboolean is_said;
        gchar *value;
    } flags[] = {
        {"--style", TRUE, g_strdup(STYLES[options->style].name)},
        {"--seed", TRUE, g_strdup_printf("%d", options->seed)},
        {"--size", TRUE, g_strdup_printf("%d", options->size)},
        {"--tiles", options->tiles > 0, g_strdup_printf("%d", options->tiles)},
        {"--mask", options->mask > 0, g_strdup(MASKS[options->mask].name)},
        {"--grout", options->grout != GROUT_OF_STYLE,
         options->grout == GROUT_COLOR ? g_strdup_printf("#%02x%02x%02x", red, green, blue)
                                       : g_strdup(GROUTS[options->grout].name)},
        {"--evals", options->evals > 0, g_strdup_printf("%d", options->evals)},
        {"--output-size", TRUE, g_strdup_printf("%d", output_side_px)},
    };
    for (guint place = 0; place < G_N_ELEMENTS(flags); place++) {
        if (flags[place].is_said) {
            g_ptr_array_add(command, g_strdup(flags[place].flag));
            g_ptr_array_add(command, flags[place].value);
        } else {
            g_free(flags[place].value);
        }
    }
}

static void finish_one(Work *work)
{
    if (--work->unfinished == 0)
        g_main_loop_quit(work->loop);
}

static void on_given(G_GNUC_UNUSED GObject *source, GAsyncResult *result, gpointer data)
{
    Work *work = data;
    /* If this failed, the program has ended early, and says why on its own. */
    gdk_pixbuf_save_to_stream_finish(result, NULL);
    g_output_stream_close(g_subprocess_get_stdin_pipe(work->child), NULL, NULL);
    finish_one(work);
}

static void on_taken(G_GNUC_UNUSED GObject *source, GAsyncResult *result, gpointer data)
{
    Work *work = data;
    work->made = gdk_pixbuf_new_from_stream_finish(result, &work->unreadable);
    /* If the picture could not be read, the program would else wait for its reader. */
    g_input_stream_close(g_subprocess_get_stdout_pipe(work->child), NULL, NULL);
    finish_one(work);
}

static void on_ended(GObject *child, GAsyncResult *result, gpointer work)
{
    g_subprocess_wait_finish(G_SUBPROCESS(child), result, NULL);
    finish_one(work);
}

static gboolean number_after(const gchar *line, const gchar *key, gdouble *number)
{
    const gchar *found = strstr(line, key);
    if (found)
        *number = g_ascii_strtod(found + strlen(key), NULL);
    return found != NULL;
}

/* Takes in a line of stderr: of progress, or the sentence of a failure. */
static void hear(Work *work, const gchar *line)
{
    gdouble done = 0, planned = 0;
    if (number_after(line, "\"evals\":", &done) && number_after(line, "\"evals_planned\":", &planned)) {
        work->progress("Laying tiles", CLAMP(done / MAX(1, planned), 0, 1));
    } else if (number_after(line, "\"drawn_share\":", &done)) {
        work->progress("Drawing tiles", CLAMP(done / 100, 0, 1));
    } else if (*line) {
        g_free(work->sentence);
        work->sentence = g_utf8_make_valid(line + (g_str_has_prefix(line, "smalti: ") ? strlen("smalti: ") : 0), -1);
    }
}

static void on_line(GObject *lines, GAsyncResult *result, gpointer data)
{
    Work *work = data;
    gchar *line = g_data_input_stream_read_line_finish(G_DATA_INPUT_STREAM(lines), result, NULL, NULL);
    if (line) {
        hear(work, g_strstrip(line));
        g_data_input_stream_read_line_async(G_DATA_INPUT_STREAM(lines), G_PRIORITY_DEFAULT, NULL, on_line, work);
    } else {
        finish_one(work);
    }
    g_free(line);
}

/* What the finished work has brought, or why there is nothing. */
static GdkPixbuf *result_of(Work *work, GError **error)
{
    GdkPixbuf *made = NULL;
    if (g_subprocess_get_successful(work->child) && work->made)
        made = g_object_ref(work->made);
    else if (g_subprocess_get_successful(work->child))
        refuse(error, "The picture that smalti made cannot be read: %s", work->unreadable->message);
    else if (work->sentence)
        refuse(error, "%s", work->sentence);
    else if (g_subprocess_get_if_exited(work->child))
        refuse(error, "smalti ended with exit code %d and gave no reason", g_subprocess_get_exit_status(work->child));
    else
        refuse(error, "smalti was ended from outside and gave no reason");
    return made;
}

/* Has the program evolve the picture and draw it with a longer side of `output_side_px`. Takes the picture over, so
 * that it is freed as soon as the program has it. NULL and an error, with the program's own sentence, if that fails. */
static GdkPixbuf *evolve(const gchar *program, GdkPixbuf *picture, const Options *options, gint output_side_px,
                         Progress progress, GError **error)
{
    static const gchar *beginning[] = {"evolve", "-", "-o", "-", "--format", "png", "--progress", "json"};
    GPtrArray *command = g_ptr_array_new_with_free_func(g_free);
    g_ptr_array_add(command, g_strdup(program));
    for (guint place = 0; place < G_N_ELEMENTS(beginning); place++)
        g_ptr_array_add(command, g_strdup(beginning[place]));
    add_flags(command, options, output_side_px);
    g_ptr_array_add(command, NULL);
    GSubprocess *child =
        start((const gchar *const *)command->pdata,
              G_SUBPROCESS_FLAGS_STDIN_PIPE | G_SUBPROCESS_FLAGS_STDOUT_PIPE | G_SUBPROCESS_FLAGS_STDERR_PIPE, error);
    g_ptr_array_unref(command);
    if (!child) {
        g_object_unref(picture);
        return NULL;
    }

    Work work = {.loop = g_main_loop_new(NULL, FALSE), .child = child, .unfinished = 4, .progress = progress};
    /* Fast rather than small: it only goes through a pipe. */
    gdk_pixbuf_save_to_stream_async(picture, g_subprocess_get_stdin_pipe(child), "png", NULL, on_given, &work,
                                    "compression", "1", NULL);
    g_object_unref(picture);
    gdk_pixbuf_new_from_stream_async(g_subprocess_get_stdout_pipe(child), NULL, on_taken, &work);
    GDataInputStream *lines = g_data_input_stream_new(g_subprocess_get_stderr_pipe(child));
    g_data_input_stream_read_line_async(lines, G_PRIORITY_DEFAULT, NULL, on_line, &work);
    g_subprocess_wait_async(child, NULL, on_ended, &work);
    g_main_loop_run(work.loop);

    GdkPixbuf *made = result_of(&work, error);
    g_clear_object(&work.made);
    g_clear_error(&work.unreadable);
    g_free(work.sentence);
    g_object_unref(lines);
    g_object_unref(child);
    g_main_loop_unref(work.loop);
    return made;
}

#endif
