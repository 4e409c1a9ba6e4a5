/* The dialog of smalti.c: asks for the options, and says how large the result will be. */
#ifndef SMALTI_DIALOG_H
#define SMALTI_DIALOG_H

#include "smalti_program.h"
/* GTK 2 itself uses what GLib has deprecated since. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
#include <libgimp/gimpui.h>
#pragma GCC diagnostic pop

enum { SIZE_MIN_PX = 16, SIZE_MAX_PX = 8192, TILES_MAX = 1000000, RESPONSE_RESET = 1 };
static const gdouble SCALE_MIN = 0.1, SCALE_MAX = 16;

static const Options DEFAULTS = {
    .grout_color = {0.5, 0.5, 0.5, 1},
    .size = 512,
    .scale = 1,
    .on_new_layer = TRUE,
};

typedef struct {
    Options *options;
    gint width, height; /* of the picture, px */
    GtkWidget *grout_color, *on_new_layer, *outcome;
    GtkSizeGroup *labels, *ends; /* the first and the last column of all sections */
} Dialog;

/* What a side of the picture becomes. */
static gint scaled(gint side_px, const Options *options)
{
    return MAX(1, (gint)(side_px * options->scale + 0.5));
}

/* Shows what the options make of each other. */
static void refresh(Dialog *dialog)
{
    const Options *options = dialog->options;
    const gboolean is_new_image = options->scale != 1;
    gtk_widget_set_sensitive(dialog->grout_color, options->grout == GROUT_COLOR);
    gtk_widget_set_sensitive(dialog->on_new_layer, !is_new_image);
    const gint width = scaled(dialog->width, options), height = scaled(dialog->height, options);
    gchar *outcome = is_new_image            ? g_strdup_printf("Makes a new image of %d × %d px", width, height)
                     : options->on_new_layer ? g_strdup_printf("Adds a layer of %d × %d px", width, height)
                                             : g_strdup_printf("Replaces %d × %d px of the layer", width, height);
    gtk_label_set_text(GTK_LABEL(dialog->outcome), outcome);
    g_free(outcome);
}

static GtkWidget *add_section(GtkWidget *box, const gchar *title, gint row_count)
{
    GtkWidget *frame = gimp_frame_new(title), *table = gtk_table_new(row_count, 3, FALSE);
    gtk_table_set_col_spacings(GTK_TABLE(table), 6);
    gtk_table_set_row_spacings(GTK_TABLE(table), 6);
    gtk_container_add(GTK_CONTAINER(frame), table);
    gtk_box_pack_start(GTK_BOX(box), frame, FALSE, FALSE, 0);
    return table;
}

/* A labelled row; `after` may be NULL, and otherwise stands at the end of it. */
static void add_row(Dialog *dialog, GtkWidget *table, gint row, const gchar *label, GtkWidget *widget, GtkWidget *after)
{
    GtkWidget *shown = gimp_table_attach_aligned(GTK_TABLE(table), 0, row, label, 0, 0.5, widget, 1, FALSE);
    gtk_size_group_add_widget(dialog->labels, shown);
    if (after) {
        gtk_size_group_add_widget(dialog->ends, after);
        gtk_table_attach(GTK_TABLE(table), after, 2, 3, row, row + 1, GTK_FILL, GTK_FILL, 0, 0);
    }
}

static GtkWidget *combo(Dialog *dialog, const Choice *choices, gint count, gint *chosen, const gchar *tip)
{
    GtkWidget *box = g_object_new(GIMP_TYPE_INT_COMBO_BOX, NULL);
    for (gint place = 0; place < count; place++)
        gimp_int_combo_box_append(GIMP_INT_COMBO_BOX(box), GIMP_INT_STORE_VALUE, place, GIMP_INT_STORE_LABEL,
                                  choices[place].label, -1);
    gimp_int_combo_box_connect(GIMP_INT_COMBO_BOX(box), *chosen, G_CALLBACK(gimp_int_combo_box_get_active), chosen);
    g_signal_connect_swapped(box, "changed", G_CALLBACK(refresh), dialog);
    gimp_help_set_help_data(box, tip, NULL);
    return box;
}

static gboolean show_zero_as_automatic(GtkSpinButton *spin)
{
    if (gtk_spin_button_get_value(spin) != 0)
        return FALSE;
    /* Setting the same text again would move the cursor. */
    if (g_strcmp0(gtk_entry_get_text(GTK_ENTRY(spin)), "Automatic") != 0)
        gtk_entry_set_text(GTK_ENTRY(spin), "Automatic");
    return TRUE;
}

static gint read_automatic_as_zero(GtkSpinButton *spin, gdouble *value)
{
    const gchar *text = gtk_entry_get_text(GTK_ENTRY(spin));
    if (g_ascii_isdigit(*text))
        return FALSE;
    *value = 0;
    return TRUE;
}

/* A spin button for whole numbers. */
static GtkWidget *whole_number(gint *value, gint low, gint high, gint step, const gchar *tip)
{
    GtkObject *adjustment = gtk_adjustment_new(*value, low, high, step, 10 * step, 0);
    GtkWidget *spin = gimp_spin_button_new(GTK_ADJUSTMENT(adjustment), 1, 0);
    gtk_spin_button_set_numeric(GTK_SPIN_BUTTON(spin), low > 0);
    gtk_entry_set_activates_default(GTK_ENTRY(spin), TRUE);
    g_signal_connect(adjustment, "value-changed", G_CALLBACK(gimp_int_adjustment_update), value);
    gimp_help_set_help_data(spin, tip, NULL);
    return spin;
}

/* A spin button for whole numbers, where 0 leaves the number to the program. */
static GtkWidget *automatic_number(gint *value, gint high, gint step, const gchar *tip)
{
    GtkWidget *spin = whole_number(value, 0, high, step, tip);
    g_signal_connect(spin, "output", G_CALLBACK(show_zero_as_automatic), NULL);
    g_signal_connect(spin, "input", G_CALLBACK(read_automatic_as_zero), NULL);
    show_zero_as_automatic(GTK_SPIN_BUTTON(spin));
    return spin;
}

static GtkWidget *unit(const gchar *text)
{
    GtkWidget *label = gtk_label_new(text);
    gtk_misc_set_alignment(GTK_MISC(label), 0, 0.5);
    return label;
}

static void roll_seed(GtkSpinButton *seed)
{
    gtk_spin_button_set_value(seed, g_random_int_range(0, G_MAXINT32));
}

static void add_tiles(Dialog *dialog, GtkWidget *box)
{
    Options *options = dialog->options;
    GtkWidget *table = add_section(box, "Tiles", 4);
    add_row(dialog, table, 0, "_Style:",
            combo(dialog, STYLES, G_N_ELEMENTS(STYLES), &options->style, "What the result looks like"), NULL);
    add_row(dialog, table, 1, "_Number:",
            automatic_number(&options->tiles, TILES_MAX, 100,
                             "Number of tiles. Automatic is 5,000 for a picture that evolves at 512 × 512 px"),
            NULL);
    add_row(dialog, table, 2, "S_hape:",
            combo(dialog, MASKS, G_N_ELEMENTS(MASKS), &options->mask, "Shape of each tile"), NULL);
    dialog->grout_color =
        gimp_color_button_new("Colour of the grout", 48, 16, &options->grout_color, GIMP_COLOR_AREA_FLAT);
    gimp_color_button_set_update(GIMP_COLOR_BUTTON(dialog->grout_color), TRUE);
    gimp_help_set_help_data(dialog->grout_color, "Colour of the grout, where it is of one colour", NULL);
    g_signal_connect(dialog->grout_color, "color-changed", G_CALLBACK(gimp_color_button_get_color),
                     &options->grout_color);
    add_row(dialog, table, 3, "_Grout:",
            combo(dialog, GROUTS, G_N_ELEMENTS(GROUTS), &options->grout, "What is seen between the tiles"),
            dialog->grout_color);
}

static void add_search(Dialog *dialog, GtkWidget *box)
{
    Options *options = dialog->options;
    GtkWidget *table = add_section(box, "Search", 3);
    add_row(dialog, table, 0, "E_volve at:",
            whole_number(&options->size, SIZE_MIN_PX, SIZE_MAX_PX, 64,
                         "Longer side at which the picture evolves. More px show finer detail and take more time; the "
                         "result has its full size all the same"),
            unit("px"));
    add_row(dialog, table, 1, "_Effort:",
            automatic_number(&options->evals, G_MAXINT32, 100000,
                             "Number of changes to try: more come closer and take more time. Automatic is 400 for each "
                             "tile"),
            unit("changes"));
    GtkWidget *seed = whole_number(&options->seed, 0, G_MAXINT32, 1,
                                   "Number that decides every random choice: the same number gives the same result");
    GtkWidget *roll = gtk_button_new_with_mnemonic("Ne_w");
    gimp_help_set_help_data(roll, "Choose another seed", NULL);
    g_signal_connect_swapped(roll, "clicked", G_CALLBACK(roll_seed), seed);
    add_row(dialog, table, 2, "See_d:", seed, roll);
}

static void add_result(Dialog *dialog, GtkWidget *box)
{
    Options *options = dialog->options;
    GtkWidget *table = add_section(box, "Result", 3);
    GtkObject *adjustment = gtk_adjustment_new(options->scale, SCALE_MIN, SCALE_MAX, 0.5, 1, 0);
    GtkWidget *scale = gimp_spin_button_new(GTK_ADJUSTMENT(adjustment), 0.5, 2);
    gtk_spin_button_set_numeric(GTK_SPIN_BUTTON(scale), TRUE);
    gtk_entry_set_activates_default(GTK_ENTRY(scale), TRUE);
    gimp_help_set_help_data(scale, "Other than 1, the tiles are drawn at this scale in a new image", NULL);
    g_signal_connect(adjustment, "value-changed", G_CALLBACK(gimp_double_adjustment_update), &options->scale);
    g_signal_connect_swapped(adjustment, "value-changed", G_CALLBACK(refresh), dialog);
    add_row(dialog, table, 0, "Sc_ale:", scale, unit("times"));

    dialog->on_new_layer = gtk_check_button_new_with_mnemonic("On a new _layer");
    gtk_toggle_button_set_active(GTK_TOGGLE_BUTTON(dialog->on_new_layer), options->on_new_layer);
    gimp_help_set_help_data(dialog->on_new_layer, "Otherwise the mosaic replaces the layer's pixels", NULL);
    g_signal_connect(dialog->on_new_layer, "toggled", G_CALLBACK(gimp_toggle_button_update), &options->on_new_layer);
    g_signal_connect_swapped(dialog->on_new_layer, "toggled", G_CALLBACK(refresh), dialog);
    gtk_table_attach(GTK_TABLE(table), dialog->on_new_layer, 1, 3, 1, 2, GTK_FILL, GTK_FILL, 0, 0);
    dialog->outcome = unit("");
    gimp_label_set_attributes(GTK_LABEL(dialog->outcome), PANGO_ATTR_STYLE, PANGO_STYLE_ITALIC, -1);
    gtk_table_attach(GTK_TABLE(table), dialog->outcome, 1, 3, 2, 3, GTK_FILL, GTK_FILL, 0, 0);
}

static GtkWidget *add_content(Dialog *dialog, GtkWidget *window)
{
    GtkWidget *box = gtk_vbox_new(FALSE, 12);
    gtk_container_set_border_width(GTK_CONTAINER(box), 12);
    dialog->labels = gtk_size_group_new(GTK_SIZE_GROUP_HORIZONTAL);
    dialog->ends = gtk_size_group_new(GTK_SIZE_GROUP_HORIZONTAL);
    add_tiles(dialog, box);
    add_search(dialog, box);
    add_result(dialog, box);
    g_object_unref(dialog->labels);
    g_object_unref(dialog->ends);
    gtk_box_pack_start(GTK_BOX(gtk_dialog_get_content_area(GTK_DIALOG(window))), box, TRUE, TRUE, 0);
    refresh(dialog);
    gtk_widget_show_all(box);
    return box;
}

/* Whether the person wants the mosaic; the options are as they were left. The picture has `width` x `height` px. */
static gboolean ask(Options *options, gint width, gint height)
{
    gimp_ui_init("smalti", FALSE);
    GtkWidget *window = gimp_dialog_new("Mosaic of Tiles", "smalti", NULL, 0, NULL, NULL, "_Reset", RESPONSE_RESET,
                                        "_Cancel", GTK_RESPONSE_CANCEL, "_OK", GTK_RESPONSE_OK, NULL);
    gtk_dialog_set_alternative_button_order(GTK_DIALOG(window), GTK_RESPONSE_OK, RESPONSE_RESET, GTK_RESPONSE_CANCEL,
                                            -1);
    gtk_dialog_set_default_response(GTK_DIALOG(window), GTK_RESPONSE_OK);
    gtk_window_set_resizable(GTK_WINDOW(window), FALSE);
    gimp_window_set_transient(GTK_WINDOW(window));
    /* So that Enter takes the options as they are. */
    gtk_widget_grab_focus(gtk_dialog_get_widget_for_response(GTK_DIALOG(window), GTK_RESPONSE_OK));
    Dialog dialog = {.options = options, .width = width, .height = height};
    GtkWidget *content = add_content(&dialog, window);
    gint answer;
    while ((answer = gimp_dialog_run(GIMP_DIALOG(window))) == RESPONSE_RESET) {
        gtk_widget_destroy(content);
        *options = DEFAULTS;
        content = add_content(&dialog, window);
    }
    gtk_widget_destroy(window);
    return answer == GTK_RESPONSE_OK;
}

#endif
